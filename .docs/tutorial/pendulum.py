"""A pendulum that somebody pushes now and then, simulated in real time, and logged.

python pendulum.py [SECONDS [FRICTION]]      without SECONDS until Ctrl-C
"""

import itertools
import math
import sys
import time

import silo

STEP_S = 0.002
LENGTH_M = 0.5


def main(seconds: float = math.inf, friction: float = 0.2) -> None:
    """Swing for so long."""
    with silo.Logger("pendulum", frequency=1 / STEP_S, folder="logs", about={"friction": friction}) as log:
        angle = log.array("angle", unit="rad", action="both")
        speed = log.array("speed", unit="rad/s", action="both")
        push = log.array("push", unit="rad/s", divider=10)  # every tenth tick is enough
        log.serve()
        log.start()
        begin_s = time.monotonic()
        for tick in itertools.count():
            now_s = tick * STEP_S
            if now_s >= seconds:
                break
            push[...] = 4.0 if tick % 1500 == 0 else 0.0  # every three seconds
            if push:
                log.mark("pushed")
            speed += push - (9.81 / LENGTH_M * math.sin(angle) + friction * speed) * STEP_S
            angle += speed * STEP_S
            log.collect()
            time.sleep(max(0.0, begin_s + now_s - time.monotonic()))


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
