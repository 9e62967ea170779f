@echo off
rem The one command of this project on Windows; run.py does the work.
rem No block in parentheses: a bracket in the path or in an argument would end it.
where py >nul 2>nul
if errorlevel 1 goto plain
py -3 "%~dp0run.py" %*
exit /b %errorlevel%
:plain
python "%~dp0run.py" %*
exit /b %errorlevel%
