"""The program's door: ``stickslip`` and ``python -m stickslip``."""

import gc
import os
import sys

from stickslip.errors import INTERRUPTED, interruption


def main() -> None:
    """Run the command line; Ctrl-C ends it in one sentence, while it is still being loaded too."""
    # read as numpy is imported: the matrices here are small, and threads that wait for each other take thrice as long
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        from stickslip.cli.program import main as program

        program(prog_name="stickslip")
    except KeyboardInterrupt as error:
        print(interruption(error), file=sys.stderr)
        sys.exit(INTERRUPTED)
    finally:
        gc.freeze()  # Python looks for garbage once more as it ends: 0.8 s among what numba has made


if __name__ == "__main__":
    main()
