"""Draws exported URDFs beside the photos of their capture: `pictures.py EXPORTS CAPTURE OUT.png`.

PyBullet's software renderer takes the cameras of training views of both states, in the layout of ArtGS, with the joints at
the observed values (the keyframes of the MJCF). Photo, drawing and their difference stand side by side. `export.json` says where
the object is in the frame of the capture.
"""

import json
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

import numpy as np
import pybullet as bullet
from PIL import Image

STATES = ("start", "end")


def to_object(exports):
    """Scale of the capture, and the motion from its scaled frame to that of the object, from `export.json`."""
    report = json.loads((exports / "export.json").read_text())
    x, y, z, w = report["frame"]["rotation"]
    motion = np.eye(4)
    motion[:3, :3] = np.reshape(bullet.getMatrixFromQuaternion([x, y, z, w]), (3, 3))
    motion[:3, 3] = report["frame"]["translation"]
    return report["scale"], motion


def camera_matrices(frame, meta, scale, motion, near=0.01, far=100.0):
    """View and projection as OpenGL takes them, column by column, in the frame of the object."""
    w, h = meta["w"], meta["h"]
    fx = meta.get("fl_x") or 0.5 * w / np.tan(0.5 * meta["camera_angle_x"])
    fy = meta.get("fl_y") or 0.5 * h / np.tan(0.5 * meta["camera_angle_y"])
    cx, cy = meta.get("cx", w / 2), meta.get("cy", h / 2)
    camera_to_world = np.array(frame["transform_matrix"], float)
    camera_to_world[:3, 3] *= scale
    view = np.linalg.inv(motion @ camera_to_world)
    projection = np.zeros((4, 4))
    projection[0] = [2 * fx / w, 0, 1 - 2 * cx / w, 0]
    projection[1] = [0, 2 * fy / h, 2 * cy / h - 1, 0]
    projection[2] = [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)]
    projection[3] = [0, 0, -1, 0]
    return view.T.ravel().tolist(), projection.T.ravel().tolist(), (w, h)


def observed(exports):
    """Joint values of both states by joint name, from the keyframes of the MJCF."""
    models = sorted((exports / "mjcf").glob("*.xml"), key=lambda path: path.stem == "scene")
    root = xml.parse(models[0]).getroot()
    names = [j.get("name") for j in root.iter("joint") if j.get("name") and j.get("type") in ("hinge", "slide", None)]
    keys = {k.get("name"): [float(v) for v in k.get("qpos").split()] for k in root.iter("key")}
    return [dict(zip(names, keys[s])) for s in STATES]


def main(exports, capture, out, views=2):
    exports, capture = Path(exports), Path(capture)
    bullet.connect(bullet.DIRECT)
    body = bullet.loadURDF(str(next((exports / "urdf").glob("*.urdf"))), useFixedBase=True)
    joints = {bullet.getJointInfo(body, i)[1].decode(): i for i in range(bullet.getNumJoints(body))}
    values, rows = observed(exports), []
    metres, motion = to_object(exports)
    for s, state in enumerate(STATES):
        for name, value in values[s].items():
            if name in joints:
                bullet.resetJointState(body, joints[name], value)
        meta = json.loads((capture / f"transforms_train_{state}.json").read_text())
        frames = meta["frames"]
        images = [Image.open(capture / f["file_path"]).convert("RGBA") for f in frames]
        cover = [(np.asarray(i)[..., 3] > 127).mean() for i in images]
        best = int(np.argmax(cover))
        for k in [best, (best + len(frames) // 3) % len(frames)][:views]:
            photo = np.asarray(images[k], float)
            meta.setdefault("w", photo.shape[1])
            meta.setdefault("h", photo.shape[0])
            view, projection, (w, h) = camera_matrices(frames[k], meta, metres, motion)
            scale = 2
            _, _, rgba, _, mask = bullet.getCameraImage(
                scale * w, scale * h, view, projection, lightDirection=[0, 0, 1], shadow=0, lightAmbientCoeff=1.0,
                lightDiffuseCoeff=0.0, lightSpecularCoeff=0.0, renderer=bullet.ER_TINY_RENDERER,
            )
            drawn = np.reshape(rgba, (scale * h, scale * w, 4))[..., :3].astype(float)
            drawn[np.reshape(mask, (scale * h, scale * w)) < 0] = 255
            alpha = photo[..., 3:] / 255
            shown = photo[..., :3] * alpha + 255 * (1 - alpha)
            shown = np.repeat(np.repeat(shown, scale, 0), scale, 1)
            rows.append(np.concatenate([shown, drawn, 255 - np.abs(shown - drawn)], 1))
    Image.fromarray(np.concatenate(rows).clip(0, 255).astype(np.uint8)).save(out)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
