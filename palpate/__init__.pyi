from palpate.ui.python.from_arrays import diagnose as diagnose
from palpate.ui.python.from_arrays import identify as identify
from palpate.ui.python.from_case import load as load
from palpate.ui.python.from_scans import analyze as analyze
from palpate.ui.python.sphere import example_sphere as example_sphere

__version__: str
__all__ = ["analyze", "diagnose", "example_sphere", "identify", "load"]
