"""Launch files in benchmarks: on a ROS master of their own, and terminated in any case."""
import contextlib
import os
import signal
import socket
import subprocess

ENDING_S = 40.0  # roslaunch waits up to 17 s for its nodes


def launch(name, arguments, timeout_s, log):
    """Run a launch file of the package, with a dictionary of arguments, until it exits or times out."""
    command = ['ros_3d_bb', name] + ['%s:=%s' % item for item in arguments.items()]
    with running_roslaunch(command, free_port(), log) as process, \
            contextlib.suppress(subprocess.TimeoutExpired):  # the caller reports the missing result
        process.wait(timeout_s)


@contextlib.contextmanager
def running_roslaunch(arguments, port, log):
    """Context in which roslaunch runs with its own master. Its nodes are terminated in any case.

    roslaunch runs in a separate session, so that a Ctrl-C in the terminal reaches it only once, through this function.
    """
    process = subprocess.Popen(['roslaunch', '-p', str(port)] + arguments, stdout=log, stderr=subprocess.STDOUT,
                               start_new_session=True,
                               env=dict(os.environ, ROS_MASTER_URI='http://localhost:%d' % port))
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)  # has no effect if it has exited
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(ENDING_S)
        process.kill()
        process.wait()


def free_port():
    """TCP port that is not in use."""
    with contextlib.closing(socket.socket()) as probe:
        probe.bind(('localhost', 0))
        return probe.getsockname()[1]
