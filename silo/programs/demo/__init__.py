"""`silo demo`: a simulated legged robot that logs through silo, as real input for trying, tests and pictures.

`program.py` is also an example of a control loop with silo in it; `robot.py` computes the motion and knows no logger.
"""
