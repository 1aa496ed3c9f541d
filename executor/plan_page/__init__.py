"""The plan page: edit a site file in the browser, plan it, and serve both."""
