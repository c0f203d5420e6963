"""The shapes of a `SceneSpec` as Mitsuba's, placed in float64 before anything is rounded."""

import numpy as np

from asmjax.geometry import basis_from_axis
from asmjax.render.working_frame import WorkingFrame
from asmjax.scene.analytic_rays import scene_bounds
from asmjax.scene.spec import Instances, Mesh, Rectangle, SceneSpec, Shape, Sphere


def spec_bounds(spec: SceneSpec) -> np.ndarray:
    """The box (3, 2) float64 that holds a spec, min and max per axis; NaN for an empty one."""
    boxes = [scene_bounds(spec.shapes)] if spec.shapes else []
    boxes += [_placed_bounds(instances) for instances in spec.instances]
    if not boxes:
        return np.full((3, 2), np.nan)
    ends = np.stack(boxes)
    return np.stack([ends[:, :, 0].min(axis=0), ends[:, :, 1].max(axis=0)], axis=1)


def _placed_bounds(instances: Instances) -> np.ndarray:
    corners = np.stack(np.meshgrid(*scene_bounds(instances.meshes))).reshape(3, -1)
    placed = instances.transforms[:, :, :3] @ corners + instances.transforms[:, :, 3:]
    return np.stack([placed.min(axis=(0, 2)), placed.max(axis=(0, 2))], axis=1)


def mitsuba_shape(mi, shape: Shape, working: WorkingFrame):
    """A shape in `working` coordinates: a Mitsuba mesh, or the dictionary of any other shape."""
    reflectance = {"type": "rgb", "value": list(shape.reflectance)}
    bsdf = {"type": "twosided", "surface": {"type": "diffuse", "reflectance": reflectance}}
    if isinstance(shape, Mesh):
        props = mi.Properties()
        props["bsdf"] = mi.load_dict(bsdf)
        props["face_normals"] = True
        mesh = mi.Mesh(shape.name, shape.vertices.shape[1], shape.faces.shape[1], props)
        params = mi.traverse(mesh)
        vertices = working.inward(shape.vertices)
        params["vertex_positions"] = np.ascontiguousarray(vertices.T, np.float32).ravel()
        params["faces"] = np.ascontiguousarray(shape.faces.T, np.uint32).ravel()
        params.update()
        return mesh
    centre = working.inward(np.array(shape.centre, np.float64)[:, None])[:, 0]
    if isinstance(shape, Sphere):
        radius = float(shape.radius * working.scale)
        return {"type": "sphere", "center": centre.tolist(), "radius": radius, "bsdf": bsdf}
    to_world = np.eye(4)
    to_world[:3, 3] = centre
    if isinstance(shape, Rectangle):
        half_u, half_v = (working.scale * np.array(half) for half in (shape.half_u, shape.half_v))
        normal = np.cross(half_u, half_v)
        to_world[:3, :3] = np.stack([half_u, half_v, normal / np.linalg.norm(normal)], axis=1)
        return {"type": "rectangle", "to_world": mi.ScalarTransform4f(to_world), "bsdf": bsdf}
    to_world[:3, :3] = basis_from_axis(shape.normal).T * (shape.radius * working.scale)
    return {"type": "disk", "to_world": mi.ScalarTransform4f(to_world), "bsdf": bsdf}
