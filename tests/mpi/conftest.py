"""Processes that wait for each other let others run: there may be more of them than processors."""

import os

os.environ["MPIR_CVAR_POLLS_BEFORE_YIELD"] = "1"
os.environ["MPIR_CVAR_ENABLE_HEAVY_YIELD"] = "1"
