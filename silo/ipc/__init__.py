"""What clients speak: keys, messages, the Zenoh session, the client. The helper process answers with the same messages.

Knows no logger, no segment and no file.
"""
