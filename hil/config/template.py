"""The commented station file that ``hil config init`` writes; a test loads it and compares it with the defaults."""

TEMPLATE = """\
# Station file of fri-hil. Every value below is the default; delete what you do not need.
# Check it with: hil config check FILE      All keys: hil config schema

realtime = false              # ask for SCHED_FIFO, locked memory and a CPU
# capture = "run.pcapng"      # record all packets
# pad = "off"                 # socket of the operator's pad (hil pad), or off; default: one only you may open

# [tcp_probe]                 # a responder for hil doctor tcp; none without this section
# bind = "127.0.0.1:30400"    # where it listens
# behaviour = "good"          # or the bad peer itself: nagle, delayed-ack, delayed-ack-200ms (emulated)

[[robot]]                     # repeat this section for more robots
name = "arm"
model = "lbr-iiwa-14-r820"    # lbr-iiwa-7-r800, lbr-iiwa-14-r820, lbr-med-7, lbr-med-14
backend = "mujoco"            # mujoco, ideal, cabinet, can402, or one of another package: hil backends
mode = "AUT"                  # T1, T2, AUT
enabled = false               # begin T1 and T2 with the enabling switch held and the start key pressed
cycle_ms = 1                  # 1, 2, 4, 5
overrun = "catch-up"          # catch-up, skip, fault: what happens to cycles that could not begin in time
seed = 0                      # of the simulated sensor noise
# inputs and outputs, Group.Name: boolean, digital or analog; hil pad io sets inputs, the FRI client sets outputs
# io = [{ name = "FRI", signal = [{ name = "Out_Lamp", type = "boolean", direction = "output" }] }]
permissive = false            # monitors only report what would have stopped the arm; never with real drives

# [robot.options]             # of the backend, each has its own: hil backends NAME

[robot.limits]                # tighter than the robot's own; seven numbers each, A1 first
t1_flange_speed_mm_s = 250.0  # at most 250
# tracking_deg = 5.0          # of a measured axis from its set point, at most 5.7
# position_min_deg = [-170, -120, -170, -120, -170, -120, -175]
# position_max_deg = [170, 120, 170, 120, 170, 120, 175]
# velocity_deg_s = [85, 85, 100, 75, 130, 135, 135]
# torque_nm = [320, 320, 176, 176, 110, 40, 40]

[robot.reaction]              # from a destination to the effective motion, for servo motions
profile = "cabinet"           # cabinet: 22 ms SmartServo, 12 ms DirectServo; ideal: none
# smart_servo_ms = 22.0       # instead of the profile's
# direct_servo_ms = 12.0

[robot.fri]                   # leave this section out for a robot without FRI
client = "127.0.0.1:30200"    # where your FRI client listens
# bind = "127.0.0.2:30200"    # where it is served from; default: any free port for a client on this machine
release = "1.15"              # release of the client's library: 1.11, 1.14, 1.15, 1.16, 2.5, 2.7
send_period_ms = 1            # 1..100, a multiple of cycle_ms
receive_multiplier = 1        # send_period_ms x receive_multiplier: at most 100 ms
overlay = "joint-position"    # none, joint-position, torque, wrench, cartesian-pose (release 2.x)
# watchdog_ms = 50            # silence that ends a commanded motion
# transformations = ["PBase"] # what the client is asked for, 5 at most

[robot.fri.control]           # of the arm while the client commands; default: what the overlay needs, else position
# mode = "joint-impedance"    # position, joint-impedance (for torque), cartesian-impedance (for wrench)
# stiffness = [1000, 1000, 1000, 1000, 1000, 1000, 1000]  # Nm/rad; Cartesian: X Y Z in N/m, A B C in Nm/rad
# damping = [0.7, 0.7, 0.7, 0.7, 0.7, 0.7, 0.7]           # damping ratios, as many as the stiffness has

[robot.servo]                 # leave this section out for a robot without servo motions
bind = "127.0.0.1:30300"      # where applications (hil.client.servo) connect to
# key_file = "servo.key"      # pre-shared key; make one with: hil config key servo.key

# [robot.kst]                 # a server for KST programs (MATLAB, Python) over TCP; it needs the servo link
# bind = "127.0.0.1:30001"    # where they connect to
# strict = false              # do as a published server does, its faults included
# nagle = false               # leave Nagle's algorithm on, as a published server does
# watchdog_ms = 1000          # silence in velocity mode that stops the arm; 0: none
# unproven_load = "replace"   # impedance with a load that is not the true one: replace (by the true one), refuse
# second_acknowledgement = true  # acknowledge the end of impedance once more, as published servers do

# Frames for Cartesian destinations, each in its parent: mm, and degrees A, B, C as Rz(A) Ry(B) Rx(C); default 0.
# [robot.base]                # the robot base in the world
# z_mm = 0.0

# [[robot.frame]]             # a reference frame, which stands still; repeat for more
# name = "table"
# parent = "base"             # world, base, or a frame before this one
# x_mm = 600.0
# y_mm = 0.0
# a_deg = 90.0
# b_deg = 0.0
# c_deg = 0.0

# [[robot.tool]]              # a tool at the flange, and its load; repeat for more
# name = "gripper"
# z_mm = 45.0                 # where it is mounted, in the flange
# mass_kg = 1.5
# centre_mm = [0.0, 0.0, 40.0]  # of mass, in the tool
# inertia_kg_m2 = [0.01, 0.01, 0.005, 0.0, 0.0, 0.0]  # about it: xx, yy, zz, xy, xz, yz
# mounted = true              # hangs on the flange from the start; impedance control reckons with its load

# [[robot.tool.frame]]        # a frame of the tool above, such as its TCP; repeat for more
# name = "tip"
# parent = "gripper"          # the tool, or a frame of it before this one
# z_mm = 150.0

# [[object]]                  # what MuJoCo arms can touch, by its middle in the world; repeat for more
# name = "bench"
# shape = "box"               # box, cylinder, sphere, plane
# size_mm = [500.0, 800.0, 40.0]  # box: x, y, z; cylinder: diameter, height; sphere: diameter; plane: none
# x_mm = 550.0
# z_mm = 380.0
# mass_kg = 0.5               # a body that can be moved; default: it stands fast
# friction = 1.0
# colour = "#8c949e"
"""
