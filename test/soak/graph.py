"""The pipeline under roslaunch, each node started again where it ends, and what roslaunch says of them."""
import os
import re
import subprocess
import threading
import time

from ros_3d_bb_lab.evaluation.latency.benchmark import end
from soak.records import Death

LAUNCH = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'soak.launch')
STARTED = re.compile(r'process\[([\w/]+)-\d+\]: started with pid \[(\d+)\]')
ENDED = re.compile(r'\[([\w/]+)-\d+\] process has (died \[pid (\d+), exit code (-?\d+)|finished cleanly)')
UNCAUGHT = re.compile(r'bad callback|Exception in thread|Segmentation|terminate called|Killed')
TOLD = 12  # lines of the log, from an exception on
NOT_OF_THE_PACKAGE = ('rosout', 'master')


class GraphEnded(Exception):
    """roslaunch ended, or its nodes never came: says why."""


class Graph(object):
    """roslaunch and its nodes. Use as a context manager.

    Attributes
    ----------
    pids : {node: process number}
        Of those that run now.
    deaths, errors : list
        See `records.Record`; an error is the next lines of the log, too.
    """

    def __init__(self, folder, port, arguments):
        self.pids, self.deaths, self.errors = {}, [], []
        self.log = os.path.join(folder, 'launch.log')
        self._command = ['roslaunch', '-p', str(port), LAUNCH] + arguments
        self._process, self._is_ending, self._left = None, False, 0

    def __enter__(self):
        # in a session of its own: a Ctrl-C in the terminal reaches it through here, once
        self._process = subprocess.Popen(self._command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                         universal_newlines=True, errors='replace', start_new_session=True)
        thread = threading.Thread(target=self._read)
        thread.daemon = True
        thread.start()
        return self

    def __exit__(self, *_):
        self._is_ending = True
        if self._process.poll() is None:
            end(self._process)

    def check(self):
        """Raise GraphEnded if roslaunch has ended."""
        if self._process.poll() is not None:
            raise GraphEnded('roslaunch ended with %d; its log is in %s' % (self._process.returncode, self.log))

    def _read(self):
        with open(self.log, 'w') as log:
            for line in self._process.stdout:
                log.write(line)
                log.flush()
                if not self._is_ending:
                    self._understand(time.monotonic(), line.strip())

    def _understand(self, now_s, line):
        started, ended = STARTED.search(line), ENDED.search(line)
        if started and started.group(1) not in NOT_OF_THE_PACKAGE:
            self.pids[started.group(1)] = int(started.group(2))
        elif ended:
            node, _how, pid, code = ended.groups()
            how = 'ended by itself' if code is None else 'died with exit code %s' % code
            self.deaths.append(Death(now_s, node, int(pid or self.pids.get(node, 0)), how))
        elif self._left > 0:
            self._left -= 1
            self.errors[-1] = self.errors[-1][0], '%s\n%s' % (self.errors[-1][1], line[:300])
        elif UNCAUGHT.search(line):
            self.errors.append((now_s, line[:300]))
            self._left = TOLD
