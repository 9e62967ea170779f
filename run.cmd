@echo off
rem The one command of this project on Windows; run.py does the work.
where py >nul 2>nul
if %errorlevel%==0 (py -3 "%~dp0run.py" %*) else (python "%~dp0run.py" %*)
exit /b %errorlevel%
