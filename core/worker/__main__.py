"""``python -m palpate.core.worker JOB.json``"""

import sys

from palpate.core.worker.child import main

if __name__ == "__main__":  # pool workers import this file again
    sys.exit(main(sys.argv[1:]))
