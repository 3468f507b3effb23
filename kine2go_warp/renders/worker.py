"""The process that draws: reads orders, writes pixels, and ends when there are no more."""

import os
import sys
from typing import BinaryIO

from kine2go_warp.errors import RenderError
from kine2go_warp.renders.canvas import Canvas
from kine2go_warp.renders.order import Order
from kine2go_warp.renders.scene import Scene
from kine2go_warp.robots import GO2

READY = "ready"


def main(library: str, width: int, height: int) -> None:
    """Say ``ready`` or what is wrong in one line, then answer every order with a picture."""
    # Drivers may print; what they say must not get among the pixels.
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    try:
        with Canvas(Scene(GO2), width, height, library) as canvas:
            answers.write(f"{READY}\n".encode())
            answers.flush()
            serve(canvas, sys.stdin.buffer, answers)
    except RenderError as error:
        answers.write(f"{error}\n".encode())
    except BrokenPipeError:
        os._exit(0)  # whoever asked has gone; nobody wants the rest


def serve(canvas: Canvas, orders: BinaryIO, answers: BinaryIO) -> None:
    """Draw until the orders end."""
    while len(data := orders.read(Order.NUM_BYTES)) == Order.NUM_BYTES:
        order = Order.from_bytes(data)
        canvas.scene.place(order.robot, order.reference)
        answers.write(canvas.draw(order.view, order.show_reference, order.show_floor).tobytes())
        answers.flush()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
