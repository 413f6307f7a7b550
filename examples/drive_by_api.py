"""Drive the arm of a running server from a program.

katana450 serve
python drive_by_api.py [URL]
"""

import sys

import numpy as np

import katana450
from katana450.server.api import answers, requests

url = sys.argv[1] if len(sys.argv) > 1 else "http://127.0.0.1:8080"

arm = katana450.load()
with katana450.connect(url, name="drive_by_api.py") as client:
    state = client.query(answers.State)
    print(f"The joints are at {np.degrees(state.q).round(1).tolist()} deg.")

    # Move the joints. The server stops the arm before a contact.
    state = client.joints([0.3, -1.0, 1.4, 0.3, 0.0])
    print(f"At the posture: {state.why or 'as requested'}.")

    # Move the tool point. Pitch and roll stay the same.
    state = client.go(requests.Position(p=np.array((0.40, 0.0, 0.0))))
    print(f"At the point: {state.why or 'as requested'}.")

    # Plan a path here and let the arm of the server follow it. A STOP on the page ends it.
    circle = arm.circle(centre=(0.150, 0.0, -0.110), radius=0.100)
    client.joints(arm.ready)
    for plan in (arm.plan(circle.start), circle):
        state = plan.run(client)
    missed = np.abs(np.array(state.q) - circle.end).max()
    print(f"The circle is done, {missed:.1e} rad from its end.")
