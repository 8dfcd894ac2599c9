# chatter completion fish | source, in ~/.config/fish/config.fish
complete -c chatter -f -a '(chatter completion words (commandline -cp) 2> /dev/null)'
