# eval "$(chatter completion zsh)" in ~/.zshrc, after compinit
_chatter() {
    local line="${(j: :)words[1,CURRENT-1]} $PREFIX" word meaning
    local -a open open_told whole whole_told
    chatter completion words "$line" 2> /dev/null | while IFS=$'\t' read -r word meaning; do
        if [[ $word == *[=./] || $word == effects=* ]]; then
            open+=("$word") open_told+=("$word${meaning:+  -- $meaning}")
        else
            whole+=("$word") whole_told+=("$word${meaning:+  -- $meaning}")
        fi
    done
    compadd -l -d whole_told -- $whole
    compadd -l -S '' -d open_told -- $open
}
compdef _chatter chatter
