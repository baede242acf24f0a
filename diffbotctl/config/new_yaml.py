"""The text of a new robot and of a new pipeline: complete, commented, and fine as they are."""

from __future__ import annotations

ROBOT = """\
# yaml-language-server: $schema={schema}
# {name}: what is bolted, soldered and plugged where. As it stands it is the 2WD kit of the book;
# change what differs on yours, then:
#     diffbotctl check {file}
#     diffbotctl wiring {file}
#     diffbotctl run goal --robot {file}
# A quantity is a plain SI number, or text with a unit: 65 mm, 90 deg, 100 rpm, 300 ms.
format: 1
kind: robot

board:
  type: mega2560            # or atmega328p (Uno, Nano)
  telemetry: 40 Hz          # how often it reports
  edge_times: true          # it also reports when the last edge of each encoder came
  deadman: 300 ms           # it stops by itself when no command came for so long
  stop_button: none         # pin of a button to ground, such as 22
  supply: vin               # what feeds it: vin (battery), regulator (the L298N's 5 V), usb

link:
  protocol: diffbot         # our firmware; rosserial: the book's
  uart: 1                   # serial port of the HC-05: 1 is pins 19 (RX) and 18 (TX); 0 is the USB
  baud: 9600                # of that port; a USB cable always means 115200
  level: divider            # 1 kOhm and 2 kOhm before the HC-05's RXD; direct: without

drive:
  type: differential
  track: 125 mm             # between the middles of the tyres; measure it
  polarity: unproven        # by_hand once you have seen both wheels turn the right way
  wheel: {{diameter: 65 mm}}  # both wheels; a side may say its own
  motor: {{driver: l298n, rated: 100 rpm, idle: coast}}
  encoder: {{channels: 1, slots: 20, edge: rising, glitch: 2 ms}}
  left:
    motor: {{enable: 5, in1: 6, in2: 7, reversed: true}}    # reversed: in1 high drives it backwards
    encoder: {{pin: 2}}       # must raise interrupts
  right:
    motor: {{enable: 8, in1: 9, in2: 10, reversed: false}}
    encoder: {{pin: 3}}

sensors:                    # {{}} for none
  front: {{type: sharp_gp2y0a41sk0f, pin: A0, at: {{x: 80 mm, y: 0 mm, heading: 0 deg}}}}

body: {{front: 80 mm, back: 150 mm, width: 151 mm}}   # from the middle of the axle; tyres included
limits: {{speed: 0.30 m/s, turn_rate: 4 rad/s, acceleration: 1.0 m/s2, braking: 1.5 m/s2}}
battery: {{full: 8.4 V}}      # two lithium cells

simulation:                 # what the simulated robot is like, drawn by --seed; no block sees it
  motor:
    lag: [60 ms, 150 ms]
    gain_spread: 0.10
    start_duty: [0.08, 0.16]
    keep_share: 0.8
    ripple: 0.02
  encoder: {{phase: random, slot_spread: 0.03, duty_spread: 0.05, jitter: 50 us}}
  slip: 0.5 mm              # standard deviation after one metre of a wheel's travel
  sensors: {{front: {{noise: 10 mV}}}}
  wiring: {{left: reversed, right: plain}}   # as the motors are soldered: see reversed above

calibration: {{}}             # written by `diffbotctl calibrate`
"""

PIPELINE = """\
# yaml-language-server: $schema={schema}
# {name}: which blocks drive the robot, and who feeds whom. A wire stands where it ends:
# `in: {{port: block.port}}`. Then:
#     diffbotctl check {file}
#     diffbotctl graph {file}
#     diffbotctl run {file}
# `diffbotctl blocks` lists what there is, `diffbotctl blocks show NAME` its ports and parameters.
format: 1
kind: pipeline

robot: {{in: {{wheels: kinematics.wheels}}}}    # what the wheels are told

goals:                                      # one after the other; heading may be left out
  - {{x: 1.0 m, y: 0.5 m, heading: 90 deg}}

blocks:
  # Where the robot is, from its encoders.
  odometry:
    block: odometry
    in: {{encoders: robot.encoders}}
  # How far the wall is, from the sensor's volts. Without a sensor: leave out this and guard.
  range:
    block: range_sensor
    in: {{volts: robot.front}}
    with: {{sensor: front}}
  # The way to the goal.
  follower:
    block: goal_follower
    in: {{odometry: odometry.odometry, goal: operator.goal}}
    with: {{tolerance: 10 mm}}
  # A person's commands go before the follower's.
  mux:
    block: command_mux
    in: {{teleop: operator.twist, autonomous: follower.twist}}
  # Speeding up and slowing down no faster than the robot's limits.
  limiter:
    block: speed_limiter
    in: {{twist: mux.twist}}
  # Only as fast as it can still stop before the wall. Last, so that a stop is never softened.
  guard:
    block: obstacle_stop
    in: {{twist: limiter.twist, range: range.range}}
    with: {{resume: by_itself}}
  # From the body's velocity to the wheels'.
  kinematics:
    block: diff_drive
    in: {{twist: guard.twist}}

world:                                      # the simulated robot's; a real one finds its own
  walls:
    - {{from: [2.5 m, -1 m], to: [2.5 m, 2 m]}}
"""
