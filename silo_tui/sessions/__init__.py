"""Where the data comes from: a live logger over its link, or a recorded file. Screens ask a session, never Zenoh."""
