# docker build -t armcal . && docker run --rm -v "$PWD:/work" armcal run titan4-quickstart
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends build-essential git python3 python3-venv
COPY . /src
RUN cd /src && .ci/wheel --profile dist --locked --features live,parquet --compatibility linux
FROM python:3.12-slim-bookworm
COPY --from=build /src/target/wheels/*.whl /tmp/
RUN pip install --no-cache-dir /tmp/*.whl && rm /tmp/*.whl
WORKDIR /work
ENTRYPOINT ["armcal"]
