"""Plan, plot and show the circle of the 2013 paper, drawn with the tip of the gripper."""

import katana450

arm = katana450.load()
circle = arm.circle(centre=(0.150, 0.0, -0.110), radius=0.100, normal=(1.0, 0.0, 0.0))
print(f"{circle.length:.3f} m in {circle.duration:.2f} s")

circle.plot().savefig("circle.png")
viewer = arm.show(circle)
print(f"Open {viewer.url}; Ctrl-C ends.", flush=True)
viewer.wait()
