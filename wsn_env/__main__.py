"""python -m wsn_env"""

import sys

from wsn_env.cli import main

sys.exit(main())
