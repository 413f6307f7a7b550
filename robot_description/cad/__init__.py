"""The arm's shape as code: ``python -m robot_description.cad`` builds the meshes of the URDF.

Dimensions are millimetres in the frame of the link they belong to; the written meshes are metres.
"""
