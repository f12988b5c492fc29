#!/usr/bin/env python3
"""check_includes.py refuses what it must and lets the rest pass."""
import os
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_includes import check  # noqa: E402


def problems(path, line):
    with tempfile.TemporaryDirectory() as root:
        os.makedirs(os.path.join(root, os.path.dirname(path)))
        with open(os.path.join(root, path), "w", encoding="utf-8") as out:
            out.write("#pragma once\n" + line + "\n")
        return check(root)


class CheckIncludes(unittest.TestCase):
    def test_refused(self):
        for path, line in [
            ("calib/geometry/a.h", '#include "datasets/io/site.h"'),
            ("datasets/io/a.cc", '#include "localize/reconstruct/tracks.h"'),
            ("survey/tags/a.cc", '#include "localize/reconstruct/tracks.h"'),
            ("localize/a.cc", '#include "survey/tags/detector.h"'),
            ("localize/a.cc", '#  include "eval/errors.h"'),
            ("eval/a.cc", '#include "app/pipeline/stages.h"'),
            ("eval/a.cc", "#include <vtkActor.h>"),
            ("app/cli/a.cc", "#include <QApplication>"),
            ("app/cli/a.cc", "#include <QtWidgets/QWidget>"),
            ("eval/scene/a.cc", "#include <QWidget>"),
            ("localize/a.cc", '#include "tests/synthetic/scene.h"'),
            ("localize/a.cc", '#include "tracks.h"'),
            ("localize/a.cc", '#include "../calib/geometry/rigid3.h"'),
        ]:
            found = problems(path, line)
            self.assertEqual(len(found), 1, (path, line))
            self.assertIn(f"{path}:2:", found[0])

    def test_allowed(self):
        for path, line in [
            ("datasets/io/a.cc", '#include "calib/geometry/rigid3.h"'),
            ("survey/panorama/a.cc", '#include "survey/tags/detector.h"'),
            ("eval/a.cc", '#include "localize/reconstruct/tracks.h"'),
            ("app/cli/a.cc", '#include "survey/tags/detector.h"'),
            ("eval/scene/a.cc", "#include <vtkActor.h>"),
            ("app/desktop/a.cc", "#include <QWidget>"),
            ("app/desktop/a.cc", "#include <vtkActor.h>"),
            ("app/cli/a.cc", "#include <vector>"),
            ("calib/camera/a.cc", "#include <opencv2/calib3d.hpp>"),
            ("calib/camera/a.cc", '// #include "app/x.h"'),
        ]:
            self.assertEqual(problems(path, line), [], (path, line))


if __name__ == "__main__":
    unittest.main()
