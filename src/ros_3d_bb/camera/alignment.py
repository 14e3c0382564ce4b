"""Checks whether the depth image is aligned to the colour image, and whether tracks are in a suitable frame.

Each returns a description of the fault, empty without one. `color` and `depth` are `camera_model.Camera`.
"""
SAME_PX = 1.0  # intrinsics that differ by less count as equal: half a pixel is 1 cm at 6 m
ALIGN = ('start the camera with realsense.launch, or realsense2_camera with align_depth:=true, and use '
         'camera/aligned_depth_to_color/image_raw')


POSE = ('set it to a frame whose z axis points up (map, odom), and publish the pose of the camera in that frame; the '
        'launch arguments camera_height:=1.2 camera_tilt:=0.1 (process_bag: --camera-height 1.2 --camera-tilt 0.1) do '
        'so for a camera alone')


def size_fault(color, width, height):
    """Compare the size of a depth image, in pixels, with that of the colour camera."""
    if (width, height) == color[:2]:
        return ''
    return 'the depth image has %d x %d pixels, the colour camera %d x %d' % ((width, height) + color[:2])


def intrinsics_fault(color, depth):
    """Compare the intrinsics of both cameras, with the tolerance `SAME_PX`."""
    if color[:2] != depth[:2]:
        return size_fault(color, depth.width, depth.height)
    if max(abs(mine - other) for mine, other in zip(color[2:6], depth[2:6])) > SAME_PX:
        return ('the intrinsics fx fy cx cy of depth are %.1f %.1f %.1f %.1f, those of colour %.1f %.1f %.1f %.1f'
                % (depth[2:6] + color[2:6]))
    return ''


def frames_fault(color_frame, depth_frame):
    """Compare the frame_ids of both images; an empty one is unknown."""
    if color_frame and depth_frame and color_frame.lstrip('/') != depth_frame.lstrip('/'):
        return 'the depth image is in the frame %s, the colour camera in %s' % (depth_frame, color_frame)
    return ''


def is_optical(frame_id):
    """Whether a frame is an optical frame by its name (REP 103): its z axis is the viewing direction."""
    return frame_id.endswith('optical_frame')


def target_frame_fault(target_frame, camera_frame=''):
    """Check that the frame of the tracks is no optical frame: neither by its name nor that of the 3D boxes."""
    target_frame = target_frame.lstrip('/')
    if is_optical(target_frame) or target_frame == camera_frame.lstrip('/'):
        return ('the target frame %s is an optical frame: its z axis is the viewing direction, but tracks need one '
                'that points up' % target_frame)
    return ''
