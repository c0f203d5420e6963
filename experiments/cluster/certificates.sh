#!/usr/bin/env bash
# A certificate authority of your own and one certificate of it, for scheduler, workers and driver:
#   experiments/cluster/certificates.sh FOLDER
# Who has these files can run programs on the cluster, so only you may read them.
set -euo pipefail
folder=${1:?usage: certificates.sh FOLDER}
umask 077
mkdir -p "$folder"
cd "$folder"

openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 365 \
  -subj "/CN=asmjax sweeps" -keyout ca-key.pem -out ca.pem 2>/dev/null
openssl req -new -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes \
  -subj "/CN=asmjax" -keyout key.pem -out request.pem 2>/dev/null
openssl x509 -req -in request.pem -CA ca.pem -CAkey ca-key.pem -CAcreateserial -days 365 \
  -out cert.pem 2>/dev/null
rm request.pem

# The folder's name may hold anything.
here=$(printf %q "$PWD")
cat > settings.sh <<END
# source this before dask and asmjax
tls=DASK_DISTRIBUTED__COMM__TLS
export \${tls}__CA_FILE=$here/ca.pem DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION=True
for role in SCHEDULER WORKER CLIENT; do
  export \${tls}__\${role}__CERT=$here/cert.pem \${tls}__\${role}__KEY=$here/key.pem
done
END
