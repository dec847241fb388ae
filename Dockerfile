# docker build -t tubecert . && docker run --rm --user "$(id -u)" -v "$PWD:/work" tubecert certify three_state.yaml
# NOT YET BUILT.
FROM python:3.12-slim AS build
WORKDIR /source
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY tubecert tubecert
RUN python -m venv /opt/tubecert && /opt/tubecert/bin/pip install --no-cache-dir -c constraints.txt ".[simulate]"

FROM python:3.12-slim
COPY --from=build /opt/tubecert /opt/tubecert
RUN useradd tubecert
USER tubecert
ENV HOME=/tmp
WORKDIR /work
ENTRYPOINT ["/opt/tubecert/bin/tubecert"]
