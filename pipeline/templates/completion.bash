# eval "$(chatter completion bash)" in ~/.bashrc
_chatter() {
    local line=${COMP_LINE:0:COMP_POINT} word begun=
    # Bash takes = and : for ends of words: what stands before the last one is not to be repeated.
    [[ ${line##*[[:space:]]} =~ ^(.*[=:]) ]] && begun=${BASH_REMATCH[1]}
    begun=${begun#[\"\']}
    COMPREPLY=()
    while IFS=$'\t' read -r word _; do
        word=${word#"$begun"}
        # Who goes on typing behind it wants no space.
        [[ $word == *[=./] || $begun == effects= ]] || word+=' '
        COMPREPLY+=("$word")
    done < <(chatter completion words "$line" 2> /dev/null)
}
complete -o nospace -o nosort -F _chatter chatter
