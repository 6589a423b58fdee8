"""The pipe between the robot program and its helper process: framing, and what is said over it.

Both ends import it, `silo/logger/` and `silo/helper/`; clients never do: what they speak lives in `silo/requests/`.
"""
