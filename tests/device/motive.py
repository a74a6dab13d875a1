"""An emulated Motive on real sockets, and the bodies it captures."""

import math
import socket
import threading
import time

from workbench.device.virtual.motive import VirtualMotive

NAMES = tuple(f"body{i}" for i in range(14))


def scene(t):
    """Fourteen bodies that move; body3 is hidden from 1 s to 2 s."""
    a = 0.3 * math.sin(2 * t)
    quat = (0.0, math.sin(a / 2), 0.0, math.cos(a / 2))
    return {name: ((0.1 * i + 0.01 * math.sin(t + i), 0.05 * i, 0.2 * math.cos(t)), quat, not (name == "body3" and 1 < t < 2))
            for i, name in enumerate(NAMES)}


class MotiveOnSockets:
    """Serves on loopback until the block ends."""

    def __init__(self, mute=False, **options):
        self.command = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.command.bind(("127.0.0.1", 0))
        self.command.settimeout(0.002)
        self.port = self.command.getsockname()[1]
        self.data = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.data.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        self.group = options.get("group", "239.255.42.99")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
            free.bind(("", 0))
            self.data_port = free.getsockname()[1]
        self.motive = VirtualMotive(NAMES, scene, started=time.monotonic(), data_port=self.data_port, **options)
        self.mute, self.running, self.client = mute, True, None
        self.thread = threading.Thread(target=self.serve)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.running = False
        self.thread.join()
        self.command.close()
        self.data.close()

    def serve(self):
        while self.running:
            try:
                question, self.client = self.command.recvfrom(65536)
                for answer in self.motive.answer(question, time.monotonic()):
                    self.command.sendto(answer, self.client)
            except OSError:
                pass
            for _, frame in self.motive.due(time.monotonic()):
                if self.mute:
                    continue
                if self.group:
                    self.data.sendto(frame, (self.group, self.data_port))
                elif self.client:
                    self.command.sendto(frame, self.client)
