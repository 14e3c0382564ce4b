"""Checks whether the depth image is aligned to the colour image.

Each returns a description of the difference, empty without one. `color` and `depth` are `camera_model.Camera`.
"""
SAME_PX = 1.0  # intrinsics that differ by less count as equal: half a pixel is 1 cm at 6 m
ALIGN = ('start the camera with realsense.launch, or realsense2_camera with align_depth:=true, and use '
         'camera/aligned_depth_to_color/image_raw, or pass depth:=raw, which registers raw depth')


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
