"""The command `./run fuzz`: wrong input for everything that takes any; prints counts."""
import argparse
import resource
import sys
import time

from fuzz.functions import fuzz_functions
from fuzz.nodes import TARGETS, fuzz_node

MEMORY = 4 * 2 ** 30  # what asks for more of it than this is a fault


def main():
    """Call functions and callbacks with wrong input; the first exception that is no refusal ends it."""
    parser = argparse.ArgumentParser(prog='./run fuzz', description='Wrong input for parsers, conversions and nodes.')
    parser.add_argument('--seed', type=int, default=1, help='the same seed gives the same input (default: 1)')
    parser.add_argument('--minutes', type=float, help='stop after so long, in all (default: when all calls are made)')
    parser.add_argument('--calls', type=int, default=10 ** 6, help='of functions (default: 1000000)')
    parser.add_argument('--messages', type=int, default=10 ** 5, help='to each node (default: 100000)')
    parser.add_argument('--only', choices=['functions'] + list(TARGETS), help='one part of it')
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    parts = [given.only] if given.only else ['functions'] + list(TARGETS)
    began_s = time.monotonic()
    for number, part in enumerate(parts, 1):
        deadline_s = float('inf') if given.minutes is None else began_s + 60 * given.minutes * number / len(parts)
        if part == 'functions':
            counts = fuzz_functions(given.seed, given.calls, deadline_s)
            for name in counts:
                print('%-45s %8d calls, %8d refused' % ((name,) + tuple(counts[name])))
            print('%-45s %8d calls' % ('functions', sum(calls for calls, _refused in counts.values())), flush=True)
        else:
            sent, cpu_s = fuzz_node(part, given.seed, given.messages, deadline_s)
            print('%-45s %8d messages, %.1f s of CPU' % (part, sent, cpu_s), flush=True)
    print('seed %d: nothing but refusals' % given.seed)


if __name__ == '__main__':
    sys.exit(main())
