"""Write the generated protobuf modules beside their schemas; a test compares them with the committed ones.

``python -m tools.make_protobuf``
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCHEMAS = ("transport/fri/fri.proto", "transport/servo/servo.proto")


def generate(target: Path) -> None:
    """Compile every schema into ``target``, laid out as in the project; raise RuntimeError if the compiler fails."""
    from grpc_tools import protoc

    for schema in SCHEMAS:
        arguments = ["protoc", f"-I{ROOT}", f"--python_out={target}", f"--pyi_out={target}", schema]
        if protoc.main(arguments) != 0:
            raise RuntimeError(f"the protobuf compiler failed on {schema}")


def generated_files() -> list[str]:
    """Return the paths that :func:`generate` writes, relative to the project."""
    return [
        str(Path(schema).with_name(Path(schema).stem + suffix))
        for schema in SCHEMAS
        for suffix in ("_pb2.py", "_pb2.pyi")
    ]


if __name__ == "__main__":
    generate(ROOT)
    sys.stdout.write("\n".join(generated_files()) + "\n")
