"""Captures in other projects' layouts, made from what `ifg capture synth` renders.

The body model is the mannequin with the keys of SMPL and its 24 joints, of which eleven turn no
vertices. SMPL parameters are those of its poses, in the axes of each layout.
"""

import json
import pickle
import sys
import types

import meshio
import numpy as np
from PIL import Image

JOINTS = 24
#: The tree of SMPL, and where the mannequin's joints are in it.
PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]
PLACES = {
    "hips": 0, "left_thigh": 1, "right_thigh": 2, "spine": 3, "left_shin": 4, "right_shin": 5,
    "left_foot": 7, "right_foot": 8, "head": 15, "left_arm": 16, "right_arm": 17,
    "left_forearm": 18, "right_forearm": 19,
}  # fmt: skip
#: A parser's numbers of our labels.
PARSER = {0: 0, 1: 13, 2: 5}
BETAS = np.linspace(-1.5, 2.0, 10)


def rotation(vector):
    """The matrix of a rotation vector [Rodrigues 1840]."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def vector_of(m):
    """The rotation vector of a matrix, of every angle, as the fixed axis and the angle about it."""
    values, vectors = np.linalg.eig(m)
    axis = np.real(vectors[:, np.argmin(np.abs(values - 1))])
    across = np.cross(axis, [1, 0, 0] if abs(axis[0]) < 0.7 else [0, 1, 0])
    across /= np.linalg.norm(across)
    turned = m @ across
    return axis * np.arctan2(np.cross(across, turned) @ axis, across @ turned)


def quaternion_matrix(q):
    w, v = q[0], np.asarray(q[1:])
    angle = 2 * np.arctan2(np.linalg.norm(v), w)
    return rotation(v / np.linalg.norm(v) * angle) if np.any(v) else np.eye(3)


def smpl(model, betas, pose, trans):
    """The posed vertices of SMPL [Loper et al. 2015], without pose-dependent directions."""
    shaped = model["v_template"] + model["shapedirs"] @ betas
    joints = model["J_regressor"] @ shaped
    frames = []
    for j in range(JOINTS):
        parent = None if j == 0 else int(model["kintree_table"][0, j])
        frame = np.eye(4)
        frame[:3, :3] = rotation(pose[j])
        frame[:3, 3] = joints[j] - (0 if parent is None else joints[parent])
        frames.append(frame if parent is None else frames[parent] @ frame)
    skin = []
    for frame, joint in zip(frames, joints, strict=True):
        moved = frame.copy()
        moved[:3, 3] -= frame[:3, :3] @ joint
        skin.append(moved)
    blended = np.einsum("vj,jab->vab", model["weights"], np.array(skin))
    ones = np.ones((len(shaped), 1))
    return np.einsum("vab,vb->va", blended, np.hstack([shaped, ones]))[:, :3] + trans


def read_template(folder):
    """Vertices, faces, weights (V, J), heads and parents of our template body."""
    mesh = meshio.read(folder / "body_clean.ply")
    joints = json.loads((folder / "skeleton.json").read_text())["joints"]
    weights = np.zeros((len(mesh.points), len(joints)))
    for k in range(4):
        rows = np.arange(len(weights))
        np.add.at(weights, (rows, mesh.point_data[f"j{k}"]), mesh.point_data[f"w{k}"])
    heads = np.array([j["head"] for j in joints])
    return mesh.points.astype(float), mesh.cells_dict["triangle"], weights, heads, joints


def posed(folder, frame):
    """Our template body in a frame, in the axes of the camera: docs/reference/capture.md."""
    meta = json.loads((folder / "meta.json").read_text())
    v, _, weights, heads, joints = read_template(folder / "body")
    record = meta["frames"][frame]
    frames = []
    for joint, head, q in zip(joints, heads, record["rot"], strict=True):
        parent = joint["parent"]
        g = np.eye(4)
        g[:3, :3] = quaternion_matrix(q)
        g[:3, 3] = head + record["root_t"] if parent < 0 else head - heads[parent]
        frames.append(g if parent < 0 else frames[parent] @ g)
    moved = sum(
        weights[:, [j]] * ((v - heads[j]) @ g[:3, :3].T + g[:3, 3]) for j, g in enumerate(frames)
    )
    return moved @ np.array(meta["R"]).T + np.array(meta["t"])


class Source:
    """A rendered capture, and its SMPL parameters in the axes of the camera."""

    def __init__(self, folder):
        self.meta = json.loads((folder / "meta.json").read_text())
        self.folder = folder
        self.k = np.array(self.meta["K"])
        v, f, weights, heads, joints = read_template(folder / "body")
        spread = np.random.default_rng(1).normal(size=(2, 3, 10))
        shapes = 0.004 * np.sin(v[:, [1]] * [[2.0, 5.0]]) @ spread.reshape(2, 30)
        shapes = shapes.reshape(-1, 3, 10)
        # Rows that return each joint, and sum to 1: of all such the smallest.
        self.places = [PLACES[joint["name"]] for joint in joints]
        all_heads = np.zeros((JOINTS, 3))
        all_heads[self.places] = heads
        for joint in set(range(JOINTS)) - set(self.places):  # beside their parents
            all_heads[joint] = all_heads[PARENTS[joint]] + [0.0, 0.03, 0.02]
        all_weights = np.zeros((len(v), JOINTS))
        all_weights[:, self.places] = weights
        system = np.vstack([v.T, np.ones(len(v))])
        rows = (np.linalg.pinv(system) @ np.vstack([all_heads.T, np.ones(JOINTS)])).T
        self.model = {
            "v_template": v - shapes @ BETAS,
            "shapedirs": shapes,
            "J_regressor": rows,
            "weights": all_weights,
            "kintree_table": np.array([[2**32 - 1, *PARENTS[1:]], range(JOINTS)], np.uint32),
            "f": f.astype(np.uint32),
        }
        self.pelvis = rows[0] @ v
        camera, shift = np.array(self.meta["R"]), np.array(self.meta["t"])
        self.poses, self.roots = [], []
        for record in self.meta["frames"]:
            turns = np.tile(np.eye(3), (JOINTS, 1, 1))
            turns[self.places] = [quaternion_matrix(q) for q in record["rot"]]
            turns[0] = camera @ turns[0]
            self.poses.append([vector_of(m) for m in turns])
            self.roots.append(camera @ (self.pelvis + record["root_t"]) + shift)
        self.poses, self.roots = np.array(self.poses), np.array(self.roots)

    def parameters(self, turn=None, shift=None):
        """Poses (n, 24, 3) and translations (n, 3) where x_cam = turn x + shift."""
        turn, shift = np.eye(3) if turn is None else turn, np.zeros(3) if shift is None else shift
        poses = self.poses.copy()
        poses[:, 0] = [vector_of(turn.T @ rotation(v)) for v in poses[:, 0]]
        return poses, (self.roots - shift) @ turn - self.pelvis

    def image(self, kind, frame):
        return np.array(Image.open(self.folder / kind / f"{frame:04}.png"))

    @property
    def count(self):
        return len(self.meta["frames"])

    def write_model(self, path, **changes):
        """An npz file, or a pickle with chumpy and scipy objects as SMPL's."""
        model = {**self.model, **changes}
        if path.suffix == ".npz":
            np.savez(path, **model)
            return path
        regressor = model["J_regressor"]
        columns, rows = np.nonzero(regressor.T)
        starts = np.searchsorted(columns, np.arange(regressor.shape[1] + 1))
        sparse = {
            "_shape": regressor.shape,
            "data": regressor[rows, columns],
            "indices": rows.astype(np.int32),
            "indptr": starts.astype(np.int32),
        }
        model["J_regressor"] = foreign("scipy.sparse.csc", "csc_matrix", sparse)
        model["shapedirs"] = foreign("chumpy.ch", "Ch", {"x": model["shapedirs"], "_itr": None})
        dump(path, model)
        return path

    def write_extras(self, folder):
        """Pictures of a parser, and normals along the axes of OpenGL."""
        numbers = np.zeros(256, np.uint8)
        numbers[list(PARSER)] = list(PARSER.values())
        for kind in ("parser", "normals"):
            (folder / kind).mkdir(parents=True)
        for frame in range(self.count):
            label = Image.fromarray(numbers[self.image("label", frame)]).convert("P")
            label.putpalette([0, 0, 0, 255, 0, 0] * 128)
            label.save(folder / "parser" / f"frame_{frame + 1}.png")
            code = self.image("normal", frame)
            known = code.any(axis=-1)
            code[known, 1:] = 255 - code[known, 1:]
            Image.fromarray(code).save(folder / "normals" / f"frame_{frame + 1}.png")


def foreign(module, name, state):
    """An object of a module that is not installed, for :func:`dump`."""
    kind = type(name, (), {"__module__": module})
    self = kind()
    self.__dict__.update(state)
    return self


def dump(path, content):
    """Pickles with the protocol of Python 2, foreign objects as those of their modules."""
    modules = {}
    for value in content.values():
        kind = type(value)
        if kind.__module__.split(".")[0] in ("chumpy", "scipy"):
            parts = kind.__module__.split(".")
            for k in range(1, len(parts) + 1):
                name = ".".join(parts[:k])
                modules.setdefault(name, types.ModuleType(name))
            setattr(modules[kind.__module__], kind.__name__, kind)
    before = {name: sys.modules.get(name) for name in modules}
    sys.modules.update(modules)
    try:
        path.write_bytes(pickle.dumps(content, protocol=2))
    finally:
        for name, module in before.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module


def people_snapshot(source, folder):
    """Written by videoavatars: no extrinsics, the body is turned by half about x."""
    import h5py

    folder.mkdir()
    camera = {
        "camera_t": np.zeros(3),
        "camera_rt": np.zeros(3),
        "camera_f": source.k[[0, 1], [0, 1]],
        "camera_c": source.k[:2, 2],
        "camera_k": np.zeros(5),
        "width": source.meta["width"],
        "height": source.meta["height"],
    }
    dump(folder / "camera.pkl", camera)
    poses, trans = source.parameters()
    with h5py.File(folder / "reconstructed_poses.hdf5", "w") as file:
        file.create_dataset("pose", data=poses.reshape(-1, 72).astype("f"), compression="lzf")
        file.create_dataset("trans", data=trans.astype("f"), compression="lzf")
        file.create_dataset("betas", data=BETAS.astype("f"))
    masks = np.array([source.image("mask", k) >= 128 for k in range(source.count)])
    with h5py.File(folder / "masks.hdf5", "w") as file:
        file.create_dataset("masks", data=masks.astype("i1"), compression="lzf")
    offsets = np.full_like(source.model["v_template"], 0.01)
    dump(folder / "consensus.pkl", {"v_personal": offsets, "betas": BETAS})


#: A rotation that is none of the special ones.
ODD = rotation(np.array([0.3, -0.5, 0.2]))


def selfrecon(source, folder):
    """Axes of PyTorch3D: x left, y up; `quat` turns the camera to the world."""
    (folder / "masks").mkdir(parents=True)
    world_to_cv, shift = ODD, np.array([0.1, -0.2, 0.4])
    flip = np.diag([-1.0, -1.0, 1.0])
    camera_to_world = (flip @ world_to_cv).T
    vector = vector_of(camera_to_world)
    angle = np.linalg.norm(vector)
    quat = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * vector / angle)])
    k = source.k
    np.savez(
        folder / "camera.npz",
        fx=k[0, 0], fy=k[1, 1], cx=k[0, 2], cy=k[1, 2], quat=quat, T=flip @ shift,
    )  # fmt: skip
    poses, trans = source.parameters(world_to_cv, shift)
    np.savez(folder / "smpl_rec.npz", poses=poses, trans=trans, shape=BETAS, gender="female")
    for frame in range(source.count):
        grey = source.image("mask", frame)
        Image.fromarray(np.stack([grey] * 3, -1)).save(folder / "masks" / f"{frame:06}.png")


def instant_avatar(source, folder):
    """Extrinsics from world to camera; masks of 0 and 1 as npy."""
    (folder / "masks").mkdir(parents=True)
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = ODD.T, [0.3, 0.1, -0.2]
    np.savez(
        folder / "cameras.npz",
        intrinsic=source.k,
        extrinsic=extrinsic,
        height=source.meta["height"],
        width=source.meta["width"],
    )
    poses, trans = source.parameters(extrinsic[:3, :3], extrinsic[:3, 3])
    np.savez(
        folder / "poses_optimized.npz",
        betas=BETAS[None].astype("f"),
        global_orient=poses[:, 0].astype("f"),
        body_pose=poses[:, 1:].reshape(-1, 69).astype("f"),
        transl=trans.astype("f"),
    )
    for frame in range(source.count):
        mask = (source.image("mask", frame) >= 128).astype(np.uint8)
        np.save(folder / "masks" / f"mask_{frame:04}.npy", mask)


LAYOUTS = {f.__name__: f for f in (people_snapshot, selfrecon, instant_avatar)}
