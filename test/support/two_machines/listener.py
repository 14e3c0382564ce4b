"""On the robot: print what the two computers send as JSON once there are enough tracks."""
import json
import sys
import time

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import CameraInfo

from ros_3d_bb.msg import TrackedObjectArray


def main():
    wanted, patience_s = int(sys.argv[1]), float(sys.argv[2])
    rospy.init_node('listener')
    images, tracks, clocks = [], [], {}

    def on_diagnostics(message):
        clocks[message.status[0].name.split(':')[0]] = message.header.stamp.to_sec() - time.time()
    rospy.Subscriber('/diagnostics', DiagnosticArray, on_diagnostics)
    rospy.Subscriber('camera/color/camera_info', CameraInfo,
                     lambda message: images.append(message.header.stamp.to_nsec()))
    rospy.Subscriber('ros_3d_bb/tracks', TrackedObjectArray, lambda message: tracks.append(
        (message.header.stamp.to_nsec(), message.header.frame_id, len(message.objects))))
    deadline_s = time.monotonic() + patience_s
    while time.monotonic() < deadline_s and (sum(people > 0 for _stamp, _frame, people in tracks) < wanted
                                             or not {'tracker_node', 'simulator_node'} <= set(clocks)):
        time.sleep(0.1)
    nodes = {name: rospy.get_master().lookupNode(name)[2]
             for name in ('/tracker_node', '/simulator_node', '/camera_mount')}
    print('RECEIVED ' + json.dumps({'images': images, 'tracks': tracks, 'clocks': clocks, 'nodes': nodes}))


if __name__ == '__main__':
    main()
