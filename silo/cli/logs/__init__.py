"""Commands on saved logs and recordings, here and on the robot."""
