"""Bags that silo writes: ROS 2 messages in MCAP, with what is known of the recording in an attachment."""
