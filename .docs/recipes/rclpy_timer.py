"""A ROS 2 node: a timer that collects, a subscription that fills variables.

Not run where silo is tested (no ROS there), only compiled. `ros2 bag play` and `ros2 bag info` take the bag that it
saves, without packages of silo.

    source /opt/ros/jazzy/setup.bash && python3 .docs/recipes/rclpy_timer.py FOLDER
"""

import sys

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import JointState

import silo

RATE_HZ = 200.0
JOINTS = 12


class Recorder(Node):
    """Logs joint states at the rate of its timer, stamped by the node's clock."""

    def __init__(self, folder: str) -> None:
        super().__init__("recorder")
        # simulated time, if use_sim_time is set
        self.log = silo.Logger(
            "joints", frequency=RATE_HZ, folder=folder, clock=lambda: self.get_clock().now().nanoseconds
        )
        options = {"group": "joints", "action": "both", "buffer": "looping", "size": "60s"}
        self.position = self.log.array("position", JOINTS, unit="rad", **options)
        self.effort = self.log.array("effort", JOINTS, unit="Nm", **options)
        self.messages = self.log.array("messages", dtype="u4")
        self.log.serve()
        self.log.start()
        # the executor of rclpy.spin has one thread: callbacks and collect() take turns in it. With a
        # MultiThreadedExecutor put both into one MutuallyExclusiveCallbackGroup, and threads="serialized" above
        self.create_subscription(JointState, "joint_states", self.on_joints, 10)
        self.create_timer(1 / RATE_HZ, self.log.collect)

    def on_joints(self, message: JointState) -> None:
        """Write into the arrays, never replace them: they are logged by reference."""
        count = min(JOINTS, len(message.position))
        self.position[:count] = message.position[:count]
        self.effort[: len(message.effort)] = message.effort[:JOINTS]
        self.messages += 1


def main(folder: str) -> None:
    """Spin until Ctrl-C, then save."""
    rclpy.init()
    node = Recorder(folder)
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.log.stop()
        for saved in node.log.save(["silo", "bag"]):
            print(saved.path)
        node.log.close()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else ".")
