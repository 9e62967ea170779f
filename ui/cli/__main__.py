"""``python -m palpate.ui.cli``: the program without its installed script."""

from palpate.ui.cli.main import entry

entry()
