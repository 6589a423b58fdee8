"""The element table and edits of it, scripts, and views of the terminal beside them: what is asked, and their folders.

Plain names below one folder on the robot's side, whatever a client asks for; no link is followed.
"""
