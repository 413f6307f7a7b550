"""The shape of the arm as code: ``python -m robot_description.cad`` builds the meshes of the URDF.

Dimensions are in millimetres, in the frame of their link. The written meshes are in metres.
"""
