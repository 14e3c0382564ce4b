"""Description of the machine that a benchmark runs on."""
import os
import platform

import numpy as np


def describe_machine():
    """Cores, CPU model and software versions as one line of text."""
    fields = {}
    if os.path.exists('/proc/cpuinfo'):
        with open('/proc/cpuinfo') as stream:
            fields = dict(line.partition(':')[::2] for line in stream if ':' in line)
    fields = {name.strip(): value.strip() for name, value in fields.items()}
    where = ' of a virtual machine' if 'hypervisor' in fields.get('flags', '').split() else ''
    return '%d cores%s, %s; Python %s, numpy %s' % (
        os.cpu_count(), where, fields.get('model name', platform.machine()), platform.python_version(), np.__version__)
