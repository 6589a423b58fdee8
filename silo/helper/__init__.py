"""The helper process: answers clients, publishes, saves, and outlives a robot process that died.

Started by `Logger.serve()` as `python -m silo.helper`; nothing imports it but `silo recover`, which saves as it does.
What it says to clients is in `silo/rpc/` and in `requests.py` of each feature, to the robot program in `silo/link/`.
"""
