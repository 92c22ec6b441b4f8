"""Publishes what it receives in upper case."""

from fastcycle.component import Component


class Crier(Component):
    def __init__(self, context):
        self.mark = context.param("mark", "!", description="Behind each cry")
        self.cries = context.publisher("cry", "example.Text")
        context.subscribe("hello", "example.Text", self.on_hello)
        self.received = 0

    def on_hello(self, message):
        self.received += 1
        self.cries.publish(text=message.text.upper() + self.mark.get())

    def stop(self):
        self.report("cried", self.received)
