"""What a robot program pushes and its helper process knows of it, and tells: the state that features share."""
