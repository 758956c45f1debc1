"""Run by an interpreter that has compas_cra: polyhedra as JSON on standard input, one JSON line on standard output."""

import json
import resource
import sys
import time
import traceback
from importlib.metadata import version
from pathlib import Path

from compas.datastructures import Mesh
from compas_assembly.datastructures import Assembly, Block
from compas_cra.algorithms import assembly_interfaces_numpy as interfaces_of_cra
from compas_cra.datastructures import CRA_Assembly
from compas_cra.equilibrium import rbe_solve

request = json.load(sys.stdin)
assembly = CRA_Assembly() if request["tool"] == "compas_cra" else Assembly()
for node, solid in enumerate(request["solids"]):
    block = Mesh.from_vertices_and_faces(solid["vertices"], solid["faces"]).copy(cls=Block)
    assembly.add_block(block, node=node)
if request["tool"] == "compas_cra":
    assembly.set_boundary_conditions(request["fixed"])
begin = time.process_time()
try:
    if request["tool"] == "compas_cra":
        interfaces_of_cra(assembly, nmax=10, amin=1e-2, tmax=1e-2)
    else:
        from compas_assembly.algorithms import assembly_interfaces_numpy

        assembly_interfaces_numpy(assembly, nmax=10, amin=1e-2, tmax=1e-2)
except Exception as error:
    place = Path(traceback.extract_tb(error.__traceback__)[-1].filename)
    where = (
        f"{place.parent.name}/{place.name}, compas {version('compas')}, {request['tool']} {version(request['tool'])}"
    )
    print(json.dumps({"failed": f"{type(error).__name__} in {where}: {error}"}))
    sys.exit()
pairs = len({tuple(sorted(edge)) for edge in assembly.graph.edges()})
verdict = "contacts only"
if request["friction"] is not None:
    try:
        rbe_solve(assembly, mu=request["friction"], density=1.0)
        verdict = "solved"
    except Exception as error:
        verdict = f"failed ({type(error).__name__})"
seconds = time.process_time() - begin
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"seconds": seconds, "pairs": pairs, "verdict": verdict, "memory_mb": memory}))
