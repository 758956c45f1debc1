"""Run by an interpreter that has compas_cra: boxes as JSON on standard input, one JSON line on standard output."""

import json
import resource
import sys
import time

from compas.datastructures import Mesh
from compas_assembly.datastructures import Block
from compas_cra.algorithms import assembly_interfaces_numpy
from compas_cra.datastructures import CRA_Assembly
from compas_cra.equilibrium import rbe_solve

QUADS = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]

request = json.load(sys.stdin)
assembly = CRA_Assembly()
for node, corners in enumerate(request["boxes"]):
    block = Mesh.from_vertices_and_faces(corners, QUADS).copy(cls=Block)
    assembly.add_block(block, node=node)
assembly.set_boundary_conditions([0])
begin = time.process_time()
assembly_interfaces_numpy(assembly, nmax=10, amin=1e-2, tmax=1e-2)
contacts = sum(len(assembly.graph.edge_attribute(edge, "interfaces")) for edge in assembly.graph.edges())
try:
    rbe_solve(assembly, mu=request["friction"], density=1.0)
    verdict = "solved"
except Exception as error:
    verdict = f"failed ({type(error).__name__})"
seconds = time.process_time() - begin
memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"seconds": seconds, "contacts": contacts, "verdict": verdict, "memory_mb": memory}))
