"""The pipeline under roslaunch, with respawned nodes, and the events in its log."""
import os
import re
import subprocess
import threading
import time

import rospy

from support.processes import end

LAUNCH = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'soak.launch')
STARTED = re.compile(r'process\[([\w/]+)-\d+\]: started with pid \[(\d+)\]')
ENDED = re.compile(r'\[([\w/]+)-\d+\] process has (died \[pid (\d+), exit code (-?\d+)|finished cleanly)')
UNCAUGHT = re.compile(r'bad callback|Exception in thread|Segmentation|terminate called|Killed')
TRACEBACK_LINES, TAIL_LINES = 12, 30
OTHER_NODES = ('rosout', 'master')


class GraphEnded(Exception):
    """roslaunch ended, or its nodes did not respond. The message contains the reason."""


class Graph(object):
    """roslaunch and its nodes: `pids` {node: process ID} of running nodes, `deaths` and `errors` of `records.Record`.

    Use as a context manager.
    """

    def __init__(self, log, port, arguments):
        self.pids, self.deaths, self.errors = {}, [], []
        self._log, self._command = log, ['roslaunch', '-p', str(port), LAUNCH] + arguments
        self._process, self._is_ending, self._lines_left = None, False, 0

    def __enter__(self):
        # In a separate session, so that a Ctrl-C in the terminal does not reach it directly. Without a buffer: the
        # process IDs of the nodes are in its output.
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                         universal_newlines=True, errors='replace', start_new_session=True,
                                         env=dict(os.environ, PYTHONUNBUFFERED='1'))
        thread = threading.Thread(target=self._read)
        thread.daemon = True
        thread.start()
        return self

    def __exit__(self, *_):
        self._is_ending = True
        end(self._process)

    def wait_for_master(self, longest_s):
        """Raises GraphEnded if there is no master in time."""
        ends_s = time.monotonic() + longest_s
        while not rospy.core.rosgraph.is_master_online():
            self.check()
            if time.monotonic() > ends_s:
                raise self.failure('no ROS master within %.0f s' % longest_s)
            time.sleep(0.1)

    def check(self):
        """Raise GraphEnded if roslaunch has ended."""
        if self._process.poll() is not None:
            raise self.failure('roslaunch ended with %d' % self._process.returncode)

    def failure(self, reason):
        """GraphEnded with the end of the log."""
        with open(self._log) as log:
            return GraphEnded('%s. The end of the log:\n%s' % (reason, ''.join(log.readlines()[-TAIL_LINES:])))

    def _read(self):
        with open(self._log, 'w') as log:
            for line in self._process.stdout:
                log.write(line)
                log.flush()
                if not self._is_ending:
                    self.parse(time.monotonic(), line.strip())

    def parse(self, now_s, line):
        """Update the attributes from a line of the log."""
        started, ended = STARTED.search(line), ENDED.search(line)
        if started and started.group(1) not in OTHER_NODES:
            self.pids[started.group(1)] = int(started.group(2))
        elif ended:
            node, _how, pid, code = ended.groups()
            pid, how = int(pid or self.pids.get(node, 0)), 'exit code %s' % code if code else 'a clean exit'
            self.deaths.append((now_s, pid, '%s (process %d) ended with %s' % (node, pid, how)))
        elif self._lines_left > 0:
            self._lines_left -= 1
            self.errors[-1] = self.errors[-1][0], '%s\n%s' % (self.errors[-1][1], line[:300])
        elif UNCAUGHT.search(line):
            self.errors.append((now_s, line[:300]))
            self._lines_left = TRACEBACK_LINES
