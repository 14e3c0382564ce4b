"""Commands of doc/campaign.md: export, analyse and validate. test/nodes/viewer_node.test measures."""
import os

from support.code_blocks import claimed

SCRIPTS = claimed('annotator/annotator --export')


def test_scripts_export_analyse_and_validate_a_session(reader, session_folder):
    folder = reader.home / 'campaign'
    folder.mkdir()
    for name in os.listdir(session_folder):
        os.symlink(os.path.join(session_folder, name), str(folder / name))
    os.symlink(str(folder), str(reader.clone / 'SESSION'))
    assert ', 0 problems' in reader.types(SCRIPTS, reader.clone)
    assert (reader.clone / 'table.csv').exists() and (folder / 'analysis' / 'report.html').exists()
