"""Bags of others: any MCAP file and any rosbag2 folder whose message types are known, topic by topic as signals.

Nothing but indices and one to three messages of some topics are read before a signal is asked for. `recording` puts
together what `mcap_file` and `sqlite_file` hold, by the types of `message_types`, decoded by `cdr` and `json_text`.
"""
