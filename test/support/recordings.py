"""Recorded 3D detections of a person ahead of a driving camera."""
import json

CAMERA = {'width': 640, 'height': 480, 'fx': 600.0, 'fy': 600.0, 'cx': 319.5, 'cy': 239.5}
FORWARD = '-0.5,0.5,-0.5,0.5'  # the camera looks along x of the fixed frame
SPEED_MPS, CAMERA_MPS, IMAGES = 0.5, 1.0, 31


def write_recording(folder, scores='0.9', ignored=''):
    """A camera that drives along x, 10 images a second; a person ahead, and one who does not count at the side."""
    folder.mkdir()
    (folder / 'camera.json').write_text(json.dumps(CAMERA))
    tables = {'poses': ['t_s,x_m,y_m,z_m,qx,qy,qz,qw'], 'ignored': ['t_s,kind,x_m,y_m,z_m,x1_px,y1_px,x2_px,y2_px'],
              'detections': ['t_s,x_m,y_m,z_m,width_m,height_m,score'],
              'truth': ['t_s,id,x_m,y_m,z_m,width_m,height_m,counts']}
    for number in range(IMAGES):
        time_s, camera_m, person_m = number / 10.0, CAMERA_MPS * number / 10.0, 8 + SPEED_MPS * number / 10.0
        tables['poses'].append('%.1f,%g,0,1,%s' % (time_s, camera_m, FORWARD))
        tables['detections'].append('%.1f,0,0,%g,0.5,1.7,%s' % (time_s, person_m - camera_m, scores))
        tables['truth'] += ['%.1f,7,%g,0,1,0.5,1.7,1' % (time_s, person_m), '%.1f,8,10,2,1,0.5,1.7,0' % time_s]
        tables['ignored'] += ['%.1f,%s' % (time_s, ignored)] if ignored else []
    for name, lines in tables.items():
        (folder / (name + '.csv')).write_text('\n'.join(lines) + '\n')
    return folder
