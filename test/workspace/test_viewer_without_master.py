from fuzz import hostile
from ros_3d_bb.core.time_sync import NS
from ros_3d_bb.nodes.viewer_node import ViewerNode
from ros_3d_bb.sessions.session_reader import read_session
from support.masterless import masterless

START_NS = 1000 * NS


def test_the_tilt_of_the_camera_is_stored_once_it_is_known(tmp_path):
    """The person is estimated upright in the floor frame, as by bbox3d_node."""
    with masterless({'window': False, 'session': str(tmp_path)}) as connections:
        node = ViewerNode()
        for number in range(2):
            stamp_ns = START_NS + number * NS // 10
            for topic, message in hostile.good_messages(stamp_ns).items():
                if topic in connections.subscribers:
                    connections.send(topic, message)
            assert node.capture()[0]
            connections.send('/tf', hostile.transforms(stamp_ns))
    unknown, known = read_session(str(tmp_path)).frames
    assert unknown.up is None and known.up.tolist() == [0, -1, 0]
