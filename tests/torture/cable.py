"""The network of ./dev torture cluster: a TUN device for each machine, and this process between them.

usage: cable.py SEED NAME=ADDRESS...     prints "ready" when the devices (NAME) are there, in the namespace it runs in
stdin: a line of JSON for each change: {"from": NAME, "to": NAME, "delay_s": 0.2, "loss": 0.05, "cut": false}, one direction

Packets of real TCP are delayed, lost or cut off, as tc netem would do it; netem itself is missing in many kernels of
virtual machines. What is on its way when a rule changes arrives as it was sent.
"""
import fcntl
import heapq
import json
import os
import random
import select
import socket
import struct
import sys
import time

TUNSETIFF, IFF_TUN, IFF_NO_PI = 0x400454CA, 0x0001, 0x1000
MOST_WAITING = 20_000  # packets; a real link drops too


def opened(name):
    device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TUN | IFF_NO_PI))
    return device


class Network:
    def __init__(self, seed, machines):
        self.random = random.Random(seed)
        self.device = {name: opened(name) for name, _ in machines}
        self.name = {device: name for name, device in self.device.items()}
        self.at = {socket.inet_aton(address): name for name, address in machines}
        self.rules = {}  # (from, to): {delay_s, loss, cut}
        self.waiting = []  # heap of (due, order, device, packet)
        self.order = 0

    def take(self, source, packet, now):
        target = self.at.get(packet[16:20]) if packet[0] >> 4 == 4 else None
        if target is None:
            return
        rule = self.rules.get((source, target), {})
        if rule.get("cut") or self.random.random() < rule.get("loss", 0):
            return
        if delay := rule.get("delay_s", 0):
            if len(self.waiting) < MOST_WAITING:
                self.order += 1
                heapq.heappush(self.waiting, (now + delay, self.order, self.device[target], packet))
        else:
            self.deliver(self.device[target], packet)

    @staticmethod
    def deliver(device, packet):
        try:
            os.write(device, packet)
        except OSError:
            pass  # not up yet, or full

    def run(self, commands):
        poll = select.poll()
        for device in [commands, *self.name]:
            poll.register(device, select.POLLIN)
        while True:
            now = time.monotonic()
            while self.waiting and self.waiting[0][0] <= now:
                self.deliver(*heapq.heappop(self.waiting)[2:])
            wait_ms = max(0, (self.waiting[0][0] - now) * 1000) if self.waiting else None
            for device, _ in poll.poll(wait_ms):
                if device == commands:
                    line = sys.stdin.readline()
                    if not line:
                        return
                    rule = json.loads(line)
                    self.rules[rule.pop("from"), rule.pop("to")] = rule
                    print("done", flush=True)
                    continue
                try:
                    self.take(self.name[device], os.read(device, 65536), time.monotonic())
                except BlockingIOError:
                    pass


machines = [word.split("=") for word in sys.argv[2:]]
network = Network(int(sys.argv[1]), machines)
print("ready", flush=True)
network.run(sys.stdin.fileno())
