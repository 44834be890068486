#!/usr/bin/env bash
# A robot that knows nothing of Python: curl and jq ask a study over HTTP, try, and tell.
#
#   surehold study create arm --parameters dx=-0.05:0.05,grip=pinch/power --noise dx=0.003 --units dx=m
#   SUREHOLD_TOKEN=a-token-of-16-characters surehold study serve arm --port 8765
#   SUREHOLD_TOKEN=a-token-of-16-characters bash examples/robot.sh http://127.0.0.1:8765/studies/arm 20
set -euo pipefail
study=$1 trials=$2

call() {  # method, path, body; waits for a service that is still starting, and prints why it refuses
  local answer
  answer=$(curl --silent --show-error --fail-with-body --retry 20 --retry-connrefused --request "$1" \
    --header "Authorization: Bearer $SUREHOLD_TOKEN" --header "Content-Type: application/json" \
    ${3:+--data "$3"} "$study/$2") || { echo "$answer" >&2; return 1; }
  echo "$answer"
}

measure() {  # your robot: goes to the parameters, and prints one number
  jq '.parameters | (if .grip == "power" then 1.2 else 1 end) - 40 * ((.dx - 0.01) | fabs)' <<<"$1"
}

for ((k = 0; k < trials; k++)); do
  asked=$(call POST ask '{"worker": "robot"}')
  call POST tell "$(jq --compact-output --argjson value "$(measure "$asked")" '{id, value: $value}' <<<"$asked")" >/dev/null
done
call GET recommendation | jq '{parameters, mean, quantile}'
