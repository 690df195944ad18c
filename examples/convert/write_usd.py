# SPDX-License-Identifier: MIT
"""A sequence as a USD stage: points with velocities and ids through time, walls as points with normals.

Time codes are frames, 1/dt of them a second; metres; the axis up is that against gravity.
"""

import os

import numpy as np

import tensorfile
from errors import ConvertError


def three(vectors):
    """[N][2] or [N][3] as [N][3]."""
    out = np.zeros((len(vectors), 3), np.float32)
    out[:, : vectors.shape[1]] = vectors
    return out


def velocities(tensors, frame, dt):
    """Stored, or the difference to the frame before."""
    stored, position = tensors["fluid.velocity"], tensors["fluid.position"]
    if frame == 0 or len(stored) == len(position):
        return stored[frame]
    return (position[frame].astype(np.float64) - position[frame - 1]) / dt


def up_axis(gravity, tokens):
    return tokens.z if len(gravity) == 3 and abs(gravity[2]) > abs(gravity[1]) else tokens.y


def write(path, output, every=1):
    """Writes every `every`-th frame of a sequence file; .usdc is binary, .usda text."""
    from pxr import Usd, UsdGeom, Vt

    if os.path.splitext(output)[1] not in (".usdc", ".usda", ".usd"):
        raise ConvertError(output, "", "the output's name ends in .usdc, .usda or .usd")
    tensors, metadata = tensorfile.read(path)
    if metadata.get("format") != "ascc.sequence":
        raise ConvertError(path, "format", f"{metadata.get('format')!r} is not 'ascc.sequence'")
    dt, radius = float(metadata["dt"]), float(metadata["particle_radius"])
    gravity = [float(g) for g in metadata["gravity"].split()]
    position = tensors["fluid.position"]
    partial = os.path.join(os.path.dirname(output), ".partial-" + os.path.basename(output))
    stage = Usd.Stage.CreateNew(partial)
    try:
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        UsdGeom.SetStageUpAxis(stage, up_axis(gravity, UsdGeom.Tokens))
        stage.SetTimeCodesPerSecond(1.0 / dt)
        stage.SetFramesPerSecond(1.0 / dt)
        stage.SetStartTimeCode(0)
        stage.SetEndTimeCode((len(position) - 1) // every * every)
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/ascc").GetPrim())
        points = UsdGeom.Points.Define(stage, "/ascc/fluid")
        points.CreateIdsAttr(Vt.Int64Array.FromNumpy(np.arange(position.shape[1]) + 1))
        points.CreateWidthsAttr(Vt.FloatArray([2.0 * radius]))
        points.SetWidthsInterpolation(UsdGeom.Tokens.constant)
        place, speed = points.CreatePointsAttr(), points.CreateVelocitiesAttr()
        extent = points.CreateExtentAttr()
        for frame in range(0, len(position), every):
            x = three(position[frame])
            v = three(velocities(tensors, frame, dt))
            place.Set(Vt.Vec3fArray.FromNumpy(x), frame)
            speed.Set(Vt.Vec3fArray.FromNumpy(v), frame)
            if len(x):
                box = np.stack([x.min(0) - radius, x.max(0) + radius]).astype(np.float32)
                extent.Set(Vt.Vec3fArray.FromNumpy(box), frame)
        if len(tensors["boundary.position"]):
            walls = UsdGeom.Points.Define(stage, "/ascc/walls")
            walls.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(three(tensors["boundary.position"])))
            walls.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(three(tensors["boundary.normal"])))
            walls.CreateWidthsAttr(Vt.FloatArray([2.0 * radius]))
            walls.SetWidthsInterpolation(UsdGeom.Tokens.constant)
            walls.CreatePurposeAttr(UsdGeom.Tokens.guide)  # not rendered
        stage.GetRootLayer().Save()
        del stage
        os.replace(partial, output)
    except BaseException:
        if os.path.exists(partial):
            os.unlink(partial)
        raise
    print(f"{output}: {len(range(0, len(position), every))} frames of {position.shape[1]} points")
