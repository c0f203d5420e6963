"""`python -m asmjax` is the `asmjax` command."""

import sys

from asmjax.cli import main

sys.exit(main())
