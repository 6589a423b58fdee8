"""ROS 2 sees a logger's signals as topics, over the Zenoh router that `rmw_zenoh` uses. Nothing of ROS is needed."""
