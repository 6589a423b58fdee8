"""Other people's viewers see a logger's signals: the same ROS 2 messages as in bags, made of rows as they come."""
