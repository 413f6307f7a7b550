# docker build -t katana450 .
# With packages of extras in docs/installation.md: docker build --build-arg EXTRAS='embreex imageio-ffmpeg' -t katana450 .
# Here alone:       docker run --rm -p 127.0.0.1:8080:8080 -p 127.0.0.1:8081:8081 katana450 serve --host 0.0.0.0 --insecure
# Other machines:   docker run --rm -p 8080:8080 -p 8081:8081 --user $(id -u) -v ./access.json:/access.json katana450
# Any image with Python 3.11 or newer and its venv module will do.
ARG BASE=docker.io/library/python:3.12.11-slim-bookworm
FROM ${BASE} AS build
ARG EXTRAS=
WORKDIR /src
COPY requirements.lock ./
RUN python3 -m venv /opt/katana450 \
 && /opt/katana450/bin/pip install --no-cache-dir --no-deps --require-hashes --requirement requirements.lock
COPY pyproject.toml README.md LICENSE ./
COPY app app
COPY robot_description robot_description
COPY static static
RUN /opt/katana450/bin/pip install --no-cache-dir --no-deps --no-build-isolation . \
 && if [ -n "$EXTRAS" ]; then /opt/katana450/bin/pip install --no-cache-dir $EXTRAS; fi

FROM ${BASE}
COPY --from=build /opt/katana450 /opt/katana450
COPY container_health.py /opt/katana450/
RUN useradd --system --create-home --uid 10450 katana
USER katana
EXPOSE 8080 8081
STOPSIGNAL SIGTERM
# Reads port and certificate in the command line of the server, whatever it is.
HEALTHCHECK --interval=30s --timeout=5s --start-period=10s \
  CMD ["/opt/katana450/bin/python", "/opt/katana450/container_health.py"]
ENTRYPOINT ["/opt/katana450/bin/katana450"]
# Inside a container the port must be open to the outside of it; -p decides who reaches it there, and
# docs/access.md says how links are made.
CMD ["serve", "--host", "0.0.0.0", "--access", "/access.json"]
