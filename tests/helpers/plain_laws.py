"""Laws with memory without the evolver that knows contact: evolutions by rays are found."""

from pwscont import SystemWithMemory


class Plain(SystemWithMemory):
    """The same law without the evolver that knows contact."""

    def __init__(self, system):
        self.system = system

    def remembering(self, memory):
        return self.system.remembering(memory)

    def memory(self, z, t):
        return self.system.memory(z, t)

    def initial_memory(self):
        return self.system.initial_memory()
