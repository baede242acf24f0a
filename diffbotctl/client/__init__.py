"""Programs that command an engine: `RobotClient` for Python, and what bridges to others share."""

from diffbotctl.client.robot_client import RobotClient

__all__ = ["RobotClient"]
