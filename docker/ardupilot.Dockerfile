# ArduPilot in simulation, of the profile `ardupilot`: the static binary that ArduPilot publishes with each release, for
# x86-64 (elsewhere it is emulated). The checksum is of Copter 4.7.1; another version needs its own.
ARG PYTHON=python:3.11-slim@sha256:9c900dea9e8fb7e16277c179b555cc72d29a352dbc33cff48ad5a0412fd5bfc7
FROM ${PYTHON}
ADD --chmod=0755 --checksum=sha256:011627d41dd95640c3aca02d45283474be48721c8b1bb7a4b234d38b69063482 \
    https://firmware.ardupilot.org/Copter/stable-4.7.1/SITL_x86_64_linux_gnu/arducopter /usr/local/bin/arducopter
USER 10001
