"""The page to plan on: a site file that is edited in the browser, its plans, and the server of both."""
