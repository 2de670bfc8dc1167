#!/bin/sh
# Runs every target, or those named, one after the other for so many seconds each, and prints a table.
#
#     fuzz/run.sh [SECONDS [TARGET ...]]
#
# JOBS=n runs n processes a target side by side; the seconds are of each. Findings are left in fuzz/artifacts/TARGET.
cd "$(dirname "$0")" || exit 1
seconds=${1:-60}
[ $# -gt 0 ] && shift
jobs=${JOBS:-1}
targets=${*:-$(cargo +nightly fuzz list)}
cargo +nightly fuzz build || exit 1
# The programs built now are run, whatever is edited during the sitting.
built=target/$(rustc -vV | sed -n 's/^host: //p')/release
export ASAN_OPTIONS="${ASAN_OPTIONS:-detect_odr_violation=0}"
logs=target/logs
mkdir -p "$logs"
printf '| target | executions | a second | coverage | findings |\n| --- | --- | --- | --- | --- |\n'
for t in $targets; do
    mkdir -p "corpus/$t" "artifacts/$t"
    before=$(find "artifacts/$t" -type f | wc -l)
    rm -f "$logs/$t".*
    pids=
    for j in $(seq "$jobs"); do
        # With -fork a finding does not end the sitting.
        "$built/$t" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=4096 -max_len=16384 -fork=1 -ignore_crashes=1 \
            -ignore_ooms=1 -ignore_timeouts=1 -artifact_prefix="artifacts/$t/" "corpus/$t" >"$logs/$t.$j" 2>&1 &
        pids="$pids $!"
    done
    wait $pids
    # Lines of the parent: "#1234: cov: 567 ft: 890 corp: 12 exec/s: 345 …".
    done=$(for j in $(seq "$jobs"); do grep -oE '^#[0-9]+: cov: [0-9]+' "$logs/$t.$j" | tail -1; done)
    executions=$(echo "$done" | sed -E 's/#([0-9]+):.*/\1/' | awk '{ n += $1 } END { print n + 0 }')
    coverage=$(echo "$done" | sed -E 's/.*cov: //' | sort -n | tail -1)
    found=$(($(find "artifacts/$t" -type f | wc -l) - before))
    printf '| %s | %s | %s | %s | %s |\n' "$t" "$executions" "$((executions / seconds))" "$coverage" "$found"
done
