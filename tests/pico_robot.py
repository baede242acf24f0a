"""The shipped robot with a Pico in place of the Mega, and with two-channel encoders."""

# In the form of `--set`; `channels` is left to the test.
PICO = [
    "robot.board.type=pico",
    "robot.board.supply=usb",
    "robot.link.uart=0",
    "robot.drive.left.motor.in1=7",
    "robot.drive.left.motor.in2=8",
    "robot.drive.right.motor.enable=11",
    "robot.drive.left.encoder.pin_b=14",
    "robot.drive.right.encoder.pin_b=15",
]
