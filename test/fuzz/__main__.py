"""The command `./run fuzz`: invalid messages for all nodes; prints counts."""
import argparse
import resource
import sys

from fuzz.nodes import TARGETS, fuzz_node

MEMORY = 4 * 2 ** 30  # limit; requests for more are errors


def main():
    """Call callbacks until the first exception other than a rejection."""
    parser = argparse.ArgumentParser(prog='./run fuzz', description=__doc__)
    parser.add_argument('--seed', type=int, default=1, help='seed of the input (default: 1)')
    parser.add_argument('--messages', type=int, default=10 ** 5, help='number for each node (default: 100000)')
    parser.add_argument('--only', choices=list(TARGETS), help='run only this node')
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    parts = [given.only] if given.only else list(TARGETS)
    for part in parts:
        sent, cpu_s = fuzz_node(part, given.seed, given.messages)
        print('%-20s %8d messages, %.1f s of CPU' % (part, sent, cpu_s), flush=True)
    print('seed %d: no errors' % given.seed)


if __name__ == '__main__':
    sys.exit(main())
